"""Routes frames: the active link of each vehicle, signatures, ground stations, duplicate ids.

Reading order: `router`, `link_selection`, `duplicate_system_ids`, then for ground stations
`ground_stations`, `gateway`, `policy`, `allowed`, `refusals`.
"""
