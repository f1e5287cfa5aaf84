"""What the pages in the browser share: a server on loopback, a camera, colours."""
