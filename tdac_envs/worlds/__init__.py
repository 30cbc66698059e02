"""Webots worlds: their model, their files and pictures of them."""
