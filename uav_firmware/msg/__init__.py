"""The topics' message types, one file per family.

Every message is immutable and readable by name. Most are a NamedTuple. Those that are made in
every control step, or read many times in one, are plain classes with slots and final fields: to
read a field of one costs the interpreter a twentieth, and compiled they hold numbers as such, not
as objects. They have no equality of their own, and no `_replace`.

Units are SI and radians; frames are in the names; `_deg` marks degrees. A field's comment gives
its unit in brackets and, where there is one, the value that means "not known".
"""
