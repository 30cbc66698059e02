"""What every room needs: errors, argument checks, extras, compiled code."""
