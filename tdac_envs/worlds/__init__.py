"""Webots worlds: what they hold, their files, pictures of them."""
