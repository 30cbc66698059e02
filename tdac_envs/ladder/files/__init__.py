"""Worlds from files: folders of maps with tasks, and worlds of the BARN challenge."""
