"""Methods compared on rooms with ground truth, in the paper's protocols."""
