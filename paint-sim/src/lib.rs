//! Spray deposit with exact books, Kubelka-Munk appearance, a renderer, and the closed-loop flight that paints.
