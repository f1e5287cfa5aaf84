"""The kinds of tasks: one folder a kind, `kinds` is the table of them."""
