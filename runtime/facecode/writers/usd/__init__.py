"""What the USD formats share: the text of a scene."""
