"""What materials share: Fresnel's equations and distributions of microfacets."""
