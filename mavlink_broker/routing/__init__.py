"""Routes frames: the active link of each vehicle, signatures, ground stations, duplicate ids.

Reading order: `router`, `link_selection`, then for ground stations `gateway`, `policy`.
"""
