"""The person: marker sets, and which markers are back, hand and elbow."""
