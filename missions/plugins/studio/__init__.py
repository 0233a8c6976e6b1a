"""The studio: a page in the browser to see, start, drive and stop robots, and the web server that serves it."""
