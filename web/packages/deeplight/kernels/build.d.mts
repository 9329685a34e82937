/** The TypeScript file with the compiled kernels. */
export function generated(): Promise<string>;
