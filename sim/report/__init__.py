"""The flight report: what was planned, believed and true, drawn from plan, ULog and truth log."""
