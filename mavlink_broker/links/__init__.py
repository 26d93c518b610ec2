"""Links to vehicles and ground stations: sockets and serial lines behind one interface.

`hub.open_links(urls)` opens any number of them. No call blocks longer than its timeout.
"""
