"""The line as the operations see it: how it is opened, what can be asked of it, and what it is kept from."""
