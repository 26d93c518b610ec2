"""The operator's side of the tester: lines, menus, scripts."""
