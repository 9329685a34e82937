"""The live page: its built files, and a small server that gives them to a browser."""
