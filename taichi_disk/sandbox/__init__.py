"""The sandbox: a disk on a page, which the user changes while it moves and sends back
in time. It knows no file of a run and no sweep."""
