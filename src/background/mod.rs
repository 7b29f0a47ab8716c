//! Every pixel's background as a mixture of Gaussians.
