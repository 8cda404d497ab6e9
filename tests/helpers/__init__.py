"""What tests share: rigs and files made by code, models, the recordings beside the checkout."""
