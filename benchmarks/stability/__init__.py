"""The atlas of stability: regimes in which methods of this kind fail, each with a severity axis and peers."""
