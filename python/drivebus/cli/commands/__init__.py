"""The commands, a file for each kind: what one types, and which results it gives. `registry` names them."""
