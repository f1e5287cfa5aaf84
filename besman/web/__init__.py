"""What the pages in the browser share: colours, camera, and the server on this machine."""
