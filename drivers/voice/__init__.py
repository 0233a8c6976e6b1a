"""Speech: a synthesiser if one is installed, else printed text."""
