"""A person at the controls: driving a robot by hand, and movements shown, written down and played back."""
