"""What every room needs: errors, checks, arrays, random draws, messages, compiled rules."""
