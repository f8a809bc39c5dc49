"""How results look: as text for people, as JSON for programs, and on a screen that changes. Asks no drive anything."""
