"""What learning needs: observation wrappers, guidance, batches for SB3."""
