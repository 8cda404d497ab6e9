"""What is fuzzed: for each format small good files to spoil, and what is done with a spoilt one."""

from tests.fuzz import characters, machines, networks, packets
from tests.fuzz.target import Target

FORMATS: dict[str, Target] = (
    characters.FORMATS | machines.FORMATS | networks.FORMATS | packets.FORMATS
)
