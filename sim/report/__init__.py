"""The flight report: planned, estimated and true motion, drawn from plan, ULog and truth log."""
