"""The topics' message types, one file per family.

Every message is a NamedTuple: immutable, cheap to make at control rate, and readable by name.
Units are SI and radians; frames are in the names; `_deg` marks degrees. A field's comment gives
its unit in brackets and, where there is one, the value that means "not known".
"""
