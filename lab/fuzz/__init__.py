"""Damage small files of every format in ways that their readers notice, and see what comes out."""
