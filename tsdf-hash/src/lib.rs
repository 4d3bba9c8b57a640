//! Dense mapping: a voxel-hashed truncated signed distance field with exactly reversible fusion, and its mesh.
