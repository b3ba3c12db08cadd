// Copyright 2026 dsse_ros maintainers
// SPDX-License-Identifier: Apache-2.0
/* Baseline: one DSSE(v1-rule) env step in C, single core. gcc -O3 -march=native -ffast-math baseline.c -o baseline -lm
   usage: baseline GRID NDRONES BATCH SECS MODE   MODE 0=eager dense matrix every step, 1=lazy (parameters only)
   rules: drones act in order (4 moves / search), supposed position drifts by accumulated vector, circle radius
   +0.5 a step, separable Gaussian inside circle, normalise (O(G) sum by prefix sums, one streaming write), person
   = argmax over 3x3 of p*U{1..100}/100, pairwise collisions by occupancy grid, rewards by v1 formulas. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <math.h>
#include <stdint.h>
#include <time.h>
typedef struct { int G,N; float *P; int *dx,*dy; float *rew; uint8_t *done; uint16_t *occ;
  double accx,accy,vx,vy; int sx,sy,cx,cy; double rad,inc; int px,py,t,limit; float scale; int hwv; uint64_t rng; } env;
static float *E1,*PRE; /* exp table by |d| ; prefix sums */
static double SIG=3.0;
static inline uint64_t xs(uint64_t *s){uint64_t x=*s;x^=x<<13;x^=x>>7;x^=x<<17;return *s=x;}
static void env_reset(env*e){int G=e->G; e->sx=e->sy=e->cx=e->cy=G/2; e->px=e->py=G/2; e->accx=e->accy=0; e->rad=1; e->inc=0; e->t=0;
  for(int i=0;i<e->N;i++){e->dx[i]=i%G;e->dy[i]=i/G;} memset(e->P,0,sizeof(float)*G*G);}
/* half width of the circle in row offset ady: largest adx with (adx+.5)^2+ady^2<=a2 and adx^2+(ady+.5)^2<=a2, or -1 */
static inline int hw(int ady,double a2){ double q1=a2-(double)ady*ady,q2=a2-(ady+.5)*(ady+.5); if(q1<0.25||q2<0)return -1;
  double h=sqrt(q1)-.5,h2=sqrt(q2); double m=h<h2?h:h2; return (int)(m+1e-9);}
static inline float pcell(const env*e,int x,int y){ /* lazy probability */
  int ady=abs(y-e->cy),adx=abs(x-e->cx); int h=hw(ady,e->rad*e->rad); if(h<adx) return 0; 
  return e->scale*E1[abs(y-e->sy)]*E1[abs(x-e->sx)];}
static void env_step(env*e,const uint8_t*act,int lazy){ int G=e->G,N=e->N; float tot=0;
  for(int i=0;i<N;i++){int a=act[i],x=e->dx[i],y=e->dy[i]; float r=1;
    if(a<4){ int nx=x+(a==1)-(a==0),ny=y+(a==3)-(a==2); if((unsigned)nx>=(unsigned)G||(unsigned)ny>=(unsigned)G){nx=x;ny=y;} e->dx[i]=nx;e->dy[i]=ny; }
    else { if(x==e->px&&y==e->py) r=100000.f+100000.f*(1.f-(float)e->t/e->limit); else { float p=lazy?pcell(e,x,y):e->P[y*G+x]; r=p*100>1?p*10000:-100; } }
    e->rew[i]=r; tot+=r; e->done[i]=0; }
  e->t++;
  /* probability matrix */
  if(fabs(e->accx)>=1)e->accx=0; if(fabs(e->accy)>=1)e->accy=0; e->accx+=e->vx;e->accy+=e->vy;
  int nx=e->sx+(int)e->accx,ny=e->sy+(int)e->accy; e->cx=e->sx; e->cy=e->sy;
  if(nx>=0&&nx<G&&ny>=0&&ny<G){e->sx=nx;e->sy=ny;}
  double a2=e->rad*e->rad; float s=0;
  /* prefix sums of E1 give sum over a row interval in O(1): S(lo,hi) relative to sx */
  int y0=e->cy-(int)e->rad,y1=e->cy+(int)e->rad; if(y0<0)y0=0; if(y1>G-1)y1=G-1;
  for(int y=y0;y<=y1;y++){int h=hw(abs(y-e->cy),a2); if(h<0)continue; int lo=e->cx-h<0?0:e->cx-h,hi=e->cx+h>G-1?G-1:e->cx+h;
    s+=E1[abs(y-e->sy)]*(PRE[hi-e->sx+G]-PRE[lo-1-e->sx+G]); }
  e->scale=1.f/s;
  if(!lazy){ memset(e->P,0,sizeof(float)*G*y0); 
    for(int y=y0;y<=y1;y++){float*row=e->P+y*G; int h=hw(abs(y-e->cy),a2); if(h<0){memset(row,0,4*G);continue;}
      int lo=e->cx-h<0?0:e->cx-h,hi=e->cx+h>G-1?G-1:e->cx+h; float k=e->scale*E1[abs(y-e->sy)];
      for(int x=0;x<lo;x++)row[x]=0; const float*ex=E1+0; int sx=e->sx; 
      for(int x=lo;x<sx&&x<=hi;x++)row[x]=k*ex[sx-x]; for(int x=lo>sx?lo:sx;x<=hi;x++)row[x]=k*ex[x-sx]; for(int x=hi+1;x<G;x++)row[x]=0; }
    memset(e->P+(y1+1)*G,0,sizeof(float)*G*(G-1-y1)); }
  /* person */
  float best=-1;int bi=0,bj=0; uint64_t u=xs(&e->rng);
  for(int j=-1;j<=1;j++)for(int i=-1;i<=1;i++){int x=e->px+i,y=e->py+j; float p=0; if((unsigned)x<(unsigned)G&&(unsigned)y<(unsigned)G) p=lazy?pcell(e,x,y):e->P[y*G+x];
    float w=p*(float)(1+u%100); u=u/100; if((i==0&&j==0))u=xs(&e->rng); if(w>best&&(unsigned)x<(unsigned)G&&(unsigned)y<(unsigned)G){best=w;bi=i;bj=j;}}
  e->px+=bi;e->py+=bj;
  e->rad=1+e->inc; e->inc+=.5;
  /* collisions */
  for(int i=0;i<N;i++)e->occ[e->dy[i]*G+e->dx[i]]++;
  for(int i=0;i<N;i++)if(e->occ[e->dy[i]*G+e->dx[i]]>1){e->rew[i]=-100000;e->done[i]=1;}
  for(int i=0;i<N;i++)e->occ[e->dy[i]*G+e->dx[i]]=0;
}
static double now(){struct timespec t;clock_gettime(CLOCK_MONOTONIC,&t);return t.tv_sec+1e-9*t.tv_nsec;}
int main(int c,char**v){ if(c==3){ int G=atoi(v[1]),k=atoi(v[2]); env e={0}; e.G=G;e.N=1;e.limit=100;e.vx=.1;e.vy=.1;e.rng=88172645463325252ull;
   E1=malloc(4*(2*G+2));PRE=calloc(2*G+2,4);for(int d=0;d<2*G+2;d++)E1[d]=expf(-(float)d*d/(2*SIG*SIG));for(int q=1;q<2*G+2;q++)PRE[q]=PRE[q-1]+E1[abs(q-G)];
   e.P=calloc(G*G,4);e.dx=calloc(1,4);e.dy=calloc(1,4);e.rew=calloc(1,4);e.done=calloc(1,1);e.occ=calloc(G*G,2);env_reset(&e);uint8_t a=5;for(int i=0;i<k;i++)env_step(&e,&a,0);
   fwrite(e.P,4,G*G,stdout);return 0;}int G=atoi(v[1]),N=atoi(v[2]),B=atoi(v[3]);double secs=atof(v[4]);int lazy=atoi(v[5]);
  E1=malloc(4*(2*G+2));PRE=calloc(2*G+2,4);for(int d=0;d<=2*G;d++)E1[d]=expf(-(float)d*d/(2*SIG*SIG));
  for(int k=1;k<2*G+2;k++)PRE[k]=PRE[k-1]+E1[abs(k-G)]; /* PRE[d+G]=sum_{-G+1..d} */
  env*es=calloc(B,sizeof(env)); float*big=malloc((size_t)B*G*G*4);
  for(int b=0;b<B;b++){env*e=es+b;e->G=G;e->N=N;e->limit=100;e->vx=e->vy=.1;e->rng=88172645463325252ull+b*7919;e->P=big+(size_t)b*G*G;
    e->dx=malloc(4*N);e->dy=malloc(4*N);e->rew=malloc(4*N);e->done=malloc(N);e->occ=calloc(G*G,2);env_reset(e);}
  uint8_t*acts=malloc(1<<16);uint64_t s=1234567;for(int i=0;i<1<<16;i++)acts[i]=xs(&s)%5;
  long n=0;double t0=now(),t=0;int off=0;
  do{ for(int rep=0;rep<(B>64?4:1000);rep++){for(int b=0;b<B;b++){env*e=es+b;if(e->t>=100)env_reset(e);env_step(e,acts+off,lazy);off=(off+N)&0xffff;if(off+N>65535)off=0;n++;}} t=now()-t0;}while(t<secs);
  printf("C grid %d drones %d batch %d %s: %.0f env steps/s  %.3f us/step  %.0f agent steps/s (sum %g)\n",G,N,B,lazy?"lazy":"eager",n/t,1e6*t/n,n/t*N,es[0].P[G/2*G+G/2]+es[0].scale);}
