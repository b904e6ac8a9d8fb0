"""Imported by a node before all else: until rospy hears an interrupt, it ends the process at once, and without a traceback.

Python would raise KeyboardInterrupt, which a library that is being imported may swallow, or hang by.
"""

import signal

signal.signal(signal.SIGINT, signal.SIG_DFL)
