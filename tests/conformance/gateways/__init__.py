"""Gateways side by side: Modbus TCP on one side, the hostile line of this package on the other.

`programs` says how each gateway is had and started, `forwarder` is one of them. `strict` is the client that judges.
`rows` has what the slave does and what the clients ask, `crowd` puts twenty clients of five makes before a simulated
line, and `crowd_clients` is one make of them in a process of its own. `measure` runs it all, `report` writes it down.

    python -m tests.conformance.run --only gateways
"""
