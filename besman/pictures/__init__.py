"""Pictures of an arm and its scene: shapes, camera, rendering."""
