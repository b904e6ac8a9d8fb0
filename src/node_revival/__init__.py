"""A process above a node: `python -m node_revival COMMAND...` starts it again when it dies, and ends it when it hangs."""
