"""What this machine has."""

import os


def machine_bytes() -> int:
    """Its memory."""
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
