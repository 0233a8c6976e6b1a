"""What all named joints share, whichever bus or topic they are on."""
