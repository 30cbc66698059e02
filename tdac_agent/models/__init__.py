"""Language models: one module per provider, prices, budget, retries."""
