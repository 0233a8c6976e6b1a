"""The tree as one page of HTML that needs nothing beside it: to look at, to search and to fold."""
