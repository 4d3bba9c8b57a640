//! Painters: what to spray where so that the canvas comes to look like a picture.
