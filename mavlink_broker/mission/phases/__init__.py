"""The phases of a mission: one class for each state, one file for each part of a flight.

A phase owns what only it needs. What several phases need belongs to the `MissionContext`. A phase
never changes the state: its hooks return what follows, and the mission looks that up in the table
of `mavlink_broker.mission.states`. No phase inherits from another one.
"""
