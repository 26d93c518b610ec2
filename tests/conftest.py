"""Settings of all tests."""

import os

from hypothesis import settings

# No example is judged by the wall clock: these machines are shared. Where CI is set, the same
# examples are drawn at every run, so that a change and not chance decides; elsewhere new ones.
settings.register_profile("default", deadline=None)
settings.register_profile("ci", deadline=None, derandomize=True)
settings.load_profile("ci" if os.environ.get("CI") else "default")
