"""The page that draws the disk: ES modules for a browser, and the messages that Python
sends to them."""
