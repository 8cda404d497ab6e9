"""A person who moves now, on a robot: poses in from the network, coordinates out."""
