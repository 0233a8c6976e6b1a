"""Trees as self-contained HTML pages with search and folding."""
