"""What is printed of a seed that fails."""

from dst.simulate import Outcome


def text_of(outcome: Outcome, hours: float = 0.0, *, is_deep: bool = False) -> str:
    """Describe an outcome, with the command that replays it."""
    faults = ",".join(sorted(outcome.faults)) or "none"
    options = f" HOURS={hours:g}" if hours else ""
    options += " DEPTH=1" if is_deep else ""
    return (
        f"seed {outcome.seed}: {outcome.failure or 'every law holds'}\n"
        f"  trace {outcome.digest[:16]}, {outcome.simulated_s:.0f} s\n"
        f"  make dst SEED={outcome.seed} FAULTS={faults}{options}"
    )
