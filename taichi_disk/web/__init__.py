"""The page that draws the disk: ES modules for a browser, and what they are told in Python."""
