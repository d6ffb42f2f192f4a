"""What the product said beside the key of its bank; the use of a sealed key is logged."""
