"""One life after the other: what a process of a node leaves to the next, and how another process sees that it hangs.

`Life` is the node's side. `node_revival` stands above the node, and starts it again.
"""

from node_life.journal import Journal
from node_life.life import Life
from node_life.watch import REFUSED, Deaths, RevivalConfig, Watch, processor_s

__all__ = ["REFUSED", "Deaths", "Journal", "Life", "RevivalConfig", "Watch", "processor_s"]
