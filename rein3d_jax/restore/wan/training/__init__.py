"""What training the diffusion network takes: its objective, what of it is trained, adapters, memory."""
