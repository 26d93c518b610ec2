"""The ways to vehicles and ground stations: sockets and serial lines behind one door.

`hub.open_links(urls)` opens any number of them; everything else here is how. Nothing here ever
blocks the caller longer than he asked to wait.
"""
