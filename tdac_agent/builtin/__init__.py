"""The provider `builtin`: no language model, a template tuned by what failed."""
