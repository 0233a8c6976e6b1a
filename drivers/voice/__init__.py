"""Speech: a synthesiser where there is one, printed words where there is none."""
