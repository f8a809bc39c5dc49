"""All that can be asked of one drive, each thing once: coroutines over a unit, whoever waits for them and however."""
