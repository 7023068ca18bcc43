"""What a deck says, checked and placed; knows nothing of XML."""
