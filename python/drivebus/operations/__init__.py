"""All that can be asked of one drive, each thing once: coroutines over a unit, whoever waits for them and however.

Two verbs put words out. `send` is for what commands: it goes out once, and where nothing is known of it afterwards,
that is said. `write` is for values that stay: what came to nothing is cleared up by reading, and only then repeated.
"""
