"""HTML pages with the tree of a mission, in one file each; a page has a search, and nodes can be folded."""
