"""The torch side: trained checkpoints to bundles that the runtime animates."""
