"""What is where on the plane: obstacles as arrays, rays and outlines against them. Compiles."""
