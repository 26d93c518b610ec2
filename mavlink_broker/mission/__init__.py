"""Missions of one vehicle, from the work item to the terminal report.

`mission_queue` holds the missions and events of the vehicle, `mission_executor` flies one of them
by the table of `states`, and `phases` has one class for each state. The other modules are what they
use: transfers, monitors of a segment in flight, aborts, changes of speed.
"""
