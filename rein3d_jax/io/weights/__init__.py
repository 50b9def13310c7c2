"""Networks' weights: NPZ and safetensors, never unpickled."""
